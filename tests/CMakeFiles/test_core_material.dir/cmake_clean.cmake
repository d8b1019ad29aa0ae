file(REMOVE_RECURSE
  "CMakeFiles/test_core_material.dir/core/test_material.c.o"
  "CMakeFiles/test_core_material.dir/core/test_material.c.o.d"
  "test_core_material"
  "test_core_material.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_core_material.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
