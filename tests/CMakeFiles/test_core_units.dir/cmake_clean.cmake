file(REMOVE_RECURSE
  "CMakeFiles/test_core_units.dir/core/test_units.c.o"
  "CMakeFiles/test_core_units.dir/core/test_units.c.o.d"
  "test_core_units"
  "test_core_units.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_core_units.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
