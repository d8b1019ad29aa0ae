
# Consider dependencies only in project.
set(CMAKE_DEPENDS_IN_PROJECT_ONLY OFF)

# The set of languages for which implicit dependencies are needed:
set(CMAKE_DEPENDS_LANGUAGES
  )

# The set of dependency files which are needed:
set(CMAKE_DEPENDS_DEPENDENCY_FILES
  "/tmp/wt/scripts/core/contact.c" "core/CMakeFiles/knead_core.dir/contact.c.o" "gcc" "core/CMakeFiles/knead_core.dir/contact.c.o.d"
  "/tmp/wt/scripts/core/grid.c" "core/CMakeFiles/knead_core.dir/grid.c.o" "gcc" "core/CMakeFiles/knead_core.dir/grid.c.o.d"
  "/tmp/wt/scripts/core/hash.c" "core/CMakeFiles/knead_core.dir/hash.c.o" "gcc" "core/CMakeFiles/knead_core.dir/hash.c.o.d"
  "/tmp/wt/scripts/core/law.c" "core/CMakeFiles/knead_core.dir/law.c.o" "gcc" "core/CMakeFiles/knead_core.dir/law.c.o.d"
  "/tmp/wt/scripts/core/material.c" "core/CMakeFiles/knead_core.dir/material.c.o" "gcc" "core/CMakeFiles/knead_core.dir/material.c.o.d"
  "/tmp/wt/scripts/core/model.c" "core/CMakeFiles/knead_core.dir/model.c.o" "gcc" "core/CMakeFiles/knead_core.dir/model.c.o.d"
  "/tmp/wt/scripts/core/safety.c" "core/CMakeFiles/knead_core.dir/safety.c.o" "gcc" "core/CMakeFiles/knead_core.dir/safety.c.o.d"
  "/tmp/wt/scripts/core/solver_implicit.c" "core/CMakeFiles/knead_core.dir/solver_implicit.c.o" "gcc" "core/CMakeFiles/knead_core.dir/solver_implicit.c.o.d"
  "/tmp/wt/scripts/core/solver_rk4.c" "core/CMakeFiles/knead_core.dir/solver_rk4.c.o" "gcc" "core/CMakeFiles/knead_core.dir/solver_rk4.c.o.d"
  "/tmp/wt/scripts/core/state.c" "core/CMakeFiles/knead_core.dir/state.c.o" "gcc" "core/CMakeFiles/knead_core.dir/state.c.o.d"
  "/tmp/wt/scripts/core/step.c" "core/CMakeFiles/knead_core.dir/step.c.o" "gcc" "core/CMakeFiles/knead_core.dir/step.c.o.d"
  "/tmp/wt/scripts/core/surface.c" "core/CMakeFiles/knead_core.dir/surface.c.o" "gcc" "core/CMakeFiles/knead_core.dir/surface.c.o.d"
  )

# Targets to which this target links.
set(CMAKE_TARGET_LINKED_INFO_FILES
  )

# Fortran module output directory.
set(CMAKE_Fortran_TARGET_MODULE_DIR "")
