file(REMOVE_RECURSE
  "CMakeFiles/knead_scene.dir/draft.c.o"
  "CMakeFiles/knead_scene.dir/draft.c.o.d"
  "CMakeFiles/knead_scene.dir/keys.c.o"
  "CMakeFiles/knead_scene.dir/keys.c.o.d"
  "CMakeFiles/knead_scene.dir/scene.c.o"
  "CMakeFiles/knead_scene.dir/scene.c.o.d"
  "CMakeFiles/knead_scene.dir/units.c.o"
  "CMakeFiles/knead_scene.dir/units.c.o.d"
  "libknead_scene.a"
  "libknead_scene.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/knead_scene.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
