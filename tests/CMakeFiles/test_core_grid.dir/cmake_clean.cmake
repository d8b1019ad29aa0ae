file(REMOVE_RECURSE
  "CMakeFiles/test_core_grid.dir/core/test_grid.c.o"
  "CMakeFiles/test_core_grid.dir/core/test_grid.c.o.d"
  "test_core_grid"
  "test_core_grid.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_core_grid.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
