file(REMOVE_RECURSE
  "CMakeFiles/knead_viewer.dir/gl.c.o"
  "CMakeFiles/knead_viewer.dir/gl.c.o.d"
  "CMakeFiles/knead_viewer.dir/image.c.o"
  "CMakeFiles/knead_viewer.dir/image.c.o.d"
  "CMakeFiles/knead_viewer.dir/offscreen_osmesa.c.o"
  "CMakeFiles/knead_viewer.dir/offscreen_osmesa.c.o.d"
  "CMakeFiles/knead_viewer.dir/renderer.c.o"
  "CMakeFiles/knead_viewer.dir/renderer.c.o.d"
  "CMakeFiles/knead_viewer.dir/skin.c.o"
  "CMakeFiles/knead_viewer.dir/skin.c.o.d"
  "libknead_viewer.a"
  "libknead_viewer.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/knead_viewer.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
