
# Consider dependencies only in project.
set(CMAKE_DEPENDS_IN_PROJECT_ONLY OFF)

# The set of languages for which implicit dependencies are needed:
set(CMAKE_DEPENDS_LANGUAGES
  )

# The set of dependency files which are needed:
set(CMAKE_DEPENDS_DEPENDENCY_FILES
  "/tmp/wt/scripts/clients/knead/check.c" "clients/CMakeFiles/knead_cli.dir/knead/check.c.o" "gcc" "clients/CMakeFiles/knead_cli.dir/knead/check.c.o.d"
  "/tmp/wt/scripts/clients/knead/dent.c" "clients/CMakeFiles/knead_cli.dir/knead/dent.c.o" "gcc" "clients/CMakeFiles/knead_cli.dir/knead/dent.c.o.d"
  "/tmp/wt/scripts/clients/knead/device.c" "clients/CMakeFiles/knead_cli.dir/knead/device.c.o" "gcc" "clients/CMakeFiles/knead_cli.dir/knead/device.c.o.d"
  "/tmp/wt/scripts/clients/knead/hand.c" "clients/CMakeFiles/knead_cli.dir/knead/hand.c.o" "gcc" "clients/CMakeFiles/knead_cli.dir/knead/hand.c.o.d"
  "/tmp/wt/scripts/clients/knead/join.c" "clients/CMakeFiles/knead_cli.dir/knead/join.c.o" "gcc" "clients/CMakeFiles/knead_cli.dir/knead/join.c.o.d"
  "/tmp/wt/scripts/clients/knead/live.c" "clients/CMakeFiles/knead_cli.dir/knead/live.c.o" "gcc" "clients/CMakeFiles/knead_cli.dir/knead/live.c.o.d"
  "/tmp/wt/scripts/clients/knead/path.c" "clients/CMakeFiles/knead_cli.dir/knead/path.c.o" "gcc" "clients/CMakeFiles/knead_cli.dir/knead/path.c.o.d"
  "/tmp/wt/scripts/clients/knead/path_csv.c" "clients/CMakeFiles/knead_cli.dir/knead/path_csv.c.o" "gcc" "clients/CMakeFiles/knead_cli.dir/knead/path_csv.c.o.d"
  "/tmp/wt/scripts/clients/knead/probe.c" "clients/CMakeFiles/knead_cli.dir/knead/probe.c.o" "gcc" "clients/CMakeFiles/knead_cli.dir/knead/probe.c.o.d"
  "/tmp/wt/scripts/clients/knead/probe_options.c" "clients/CMakeFiles/knead_cli.dir/knead/probe_options.c.o" "gcc" "clients/CMakeFiles/knead_cli.dir/knead/probe_options.c.o.d"
  "/tmp/wt/scripts/clients/knead/record.c" "clients/CMakeFiles/knead_cli.dir/knead/record.c.o" "gcc" "clients/CMakeFiles/knead_cli.dir/knead/record.c.o.d"
  "/tmp/wt/scripts/clients/knead/replay.c" "clients/CMakeFiles/knead_cli.dir/knead/replay.c.o" "gcc" "clients/CMakeFiles/knead_cli.dir/knead/replay.c.o.d"
  "/tmp/wt/scripts/clients/knead/report.c" "clients/CMakeFiles/knead_cli.dir/knead/report.c.o" "gcc" "clients/CMakeFiles/knead_cli.dir/knead/report.c.o.d"
  "/tmp/wt/scripts/clients/knead/view.c" "clients/CMakeFiles/knead_cli.dir/knead/view.c.o" "gcc" "clients/CMakeFiles/knead_cli.dir/knead/view.c.o.d"
  )

# Targets to which this target links.
set(CMAKE_TARGET_LINKED_INFO_FILES
  "/tmp/wt/scripts/server/CMakeFiles/knead_server.dir/DependInfo.cmake"
  "/tmp/wt/scripts/clients/viewer/CMakeFiles/knead_viewer.dir/DependInfo.cmake"
  "/tmp/wt/scripts/core/scene/CMakeFiles/knead_scene.dir/DependInfo.cmake"
  "/tmp/wt/scripts/proto/CMakeFiles/knead_proto.dir/DependInfo.cmake"
  "/tmp/wt/scripts/core/CMakeFiles/knead_core.dir/DependInfo.cmake"
  )

# Fortran module output directory.
set(CMAKE_Fortran_TARGET_MODULE_DIR "")
