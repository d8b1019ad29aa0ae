
# Consider dependencies only in project.
set(CMAKE_DEPENDS_IN_PROJECT_ONLY OFF)

# The set of languages for which implicit dependencies are needed:
set(CMAKE_DEPENDS_LANGUAGES
  )

# The set of dependency files which are needed:
set(CMAKE_DEPENDS_DEPENDENCY_FILES
  "/tmp/wt/scripts/tests/physics/test_materials.c" "tests/CMakeFiles/test_physics_materials.dir/physics/test_materials.c.o" "gcc" "tests/CMakeFiles/test_physics_materials.dir/physics/test_materials.c.o.d"
  )

# Targets to which this target links.
set(CMAKE_TARGET_LINKED_INFO_FILES
  "/tmp/wt/scripts/clients/CMakeFiles/knead_cli.dir/DependInfo.cmake"
  "/tmp/wt/scripts/server/CMakeFiles/knead_server.dir/DependInfo.cmake"
  "/tmp/wt/scripts/clients/viewer/CMakeFiles/knead_viewer.dir/DependInfo.cmake"
  "/tmp/wt/scripts/core/scene/CMakeFiles/knead_scene.dir/DependInfo.cmake"
  "/tmp/wt/scripts/proto/CMakeFiles/knead_proto.dir/DependInfo.cmake"
  "/tmp/wt/scripts/core/CMakeFiles/knead_core.dir/DependInfo.cmake"
  )

# Fortran module output directory.
set(CMAKE_Fortran_TARGET_MODULE_DIR "")
