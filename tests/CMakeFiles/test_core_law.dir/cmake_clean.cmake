file(REMOVE_RECURSE
  "CMakeFiles/test_core_law.dir/core/test_law.c.o"
  "CMakeFiles/test_core_law.dir/core/test_law.c.o.d"
  "test_core_law"
  "test_core_law.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_core_law.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
