file(REMOVE_RECURSE
  "CMakeFiles/test_core_surface.dir/core/test_surface.c.o"
  "CMakeFiles/test_core_surface.dir/core/test_surface.c.o.d"
  "test_core_surface"
  "test_core_surface.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_core_surface.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
