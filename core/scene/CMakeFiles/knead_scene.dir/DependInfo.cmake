
# Consider dependencies only in project.
set(CMAKE_DEPENDS_IN_PROJECT_ONLY OFF)

# The set of languages for which implicit dependencies are needed:
set(CMAKE_DEPENDS_LANGUAGES
  )

# The set of dependency files which are needed:
set(CMAKE_DEPENDS_DEPENDENCY_FILES
  "/tmp/wt/scripts/core/scene/draft.c" "core/scene/CMakeFiles/knead_scene.dir/draft.c.o" "gcc" "core/scene/CMakeFiles/knead_scene.dir/draft.c.o.d"
  "/tmp/wt/scripts/core/scene/keys.c" "core/scene/CMakeFiles/knead_scene.dir/keys.c.o" "gcc" "core/scene/CMakeFiles/knead_scene.dir/keys.c.o.d"
  "/tmp/wt/scripts/core/scene/scene.c" "core/scene/CMakeFiles/knead_scene.dir/scene.c.o" "gcc" "core/scene/CMakeFiles/knead_scene.dir/scene.c.o.d"
  "/tmp/wt/scripts/core/scene/units.c" "core/scene/CMakeFiles/knead_scene.dir/units.c.o" "gcc" "core/scene/CMakeFiles/knead_scene.dir/units.c.o.d"
  )

# Targets to which this target links.
set(CMAKE_TARGET_LINKED_INFO_FILES
  "/tmp/wt/scripts/core/CMakeFiles/knead_core.dir/DependInfo.cmake"
  )

# Fortran module output directory.
set(CMAKE_Fortran_TARGET_MODULE_DIR "")
