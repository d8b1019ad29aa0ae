
# Consider dependencies only in project.
set(CMAKE_DEPENDS_IN_PROJECT_ONLY OFF)

# The set of languages for which implicit dependencies are needed:
set(CMAKE_DEPENDS_LANGUAGES
  )

# The set of dependency files which are needed:
set(CMAKE_DEPENDS_DEPENDENCY_FILES
  "/tmp/wt/scripts/clients/viewer/gl.c" "clients/viewer/CMakeFiles/knead_viewer.dir/gl.c.o" "gcc" "clients/viewer/CMakeFiles/knead_viewer.dir/gl.c.o.d"
  "/tmp/wt/scripts/clients/viewer/image.c" "clients/viewer/CMakeFiles/knead_viewer.dir/image.c.o" "gcc" "clients/viewer/CMakeFiles/knead_viewer.dir/image.c.o.d"
  "/tmp/wt/scripts/clients/viewer/offscreen_osmesa.c" "clients/viewer/CMakeFiles/knead_viewer.dir/offscreen_osmesa.c.o" "gcc" "clients/viewer/CMakeFiles/knead_viewer.dir/offscreen_osmesa.c.o.d"
  "/tmp/wt/scripts/clients/viewer/renderer.c" "clients/viewer/CMakeFiles/knead_viewer.dir/renderer.c.o" "gcc" "clients/viewer/CMakeFiles/knead_viewer.dir/renderer.c.o.d"
  "/tmp/wt/scripts/clients/viewer/skin.c" "clients/viewer/CMakeFiles/knead_viewer.dir/skin.c.o" "gcc" "clients/viewer/CMakeFiles/knead_viewer.dir/skin.c.o.d"
  )

# Targets to which this target links.
set(CMAKE_TARGET_LINKED_INFO_FILES
  "/tmp/wt/scripts/core/CMakeFiles/knead_core.dir/DependInfo.cmake"
  )

# Fortran module output directory.
set(CMAKE_Fortran_TARGET_MODULE_DIR "")
