file(REMOVE_RECURSE
  "CMakeFiles/test_core_scene.dir/core/test_scene.c.o"
  "CMakeFiles/test_core_scene.dir/core/test_scene.c.o.d"
  "test_core_scene"
  "test_core_scene.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_core_scene.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
