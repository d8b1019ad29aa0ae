
# Consider dependencies only in project.
set(CMAKE_DEPENDS_IN_PROJECT_ONLY OFF)

# The set of languages for which implicit dependencies are needed:
set(CMAKE_DEPENDS_LANGUAGES
  )

# The set of dependency files which are needed:
set(CMAKE_DEPENDS_DEPENDENCY_FILES
  "/tmp/wt/scripts/server/account.c" "server/CMakeFiles/knead_server.dir/account.c.o" "gcc" "server/CMakeFiles/knead_server.dir/account.c.o.d"
  "/tmp/wt/scripts/server/backend/cpu.c" "server/CMakeFiles/knead_server.dir/backend/cpu.c.o" "gcc" "server/CMakeFiles/knead_server.dir/backend/cpu.c.o.d"
  "/tmp/wt/scripts/server/bus.c" "server/CMakeFiles/knead_server.dir/bus.c.o" "gcc" "server/CMakeFiles/knead_server.dir/bus.c.o.d"
  "/tmp/wt/scripts/server/clock.c" "server/CMakeFiles/knead_server.dir/clock.c.o" "gcc" "server/CMakeFiles/knead_server.dir/clock.c.o.d"
  "/tmp/wt/scripts/server/daemon.c" "server/CMakeFiles/knead_server.dir/daemon.c.o" "gcc" "server/CMakeFiles/knead_server.dir/daemon.c.o.d"
  "/tmp/wt/scripts/server/log.c" "server/CMakeFiles/knead_server.dir/log.c.o" "gcc" "server/CMakeFiles/knead_server.dir/log.c.o.d"
  "/tmp/wt/scripts/server/loop.c" "server/CMakeFiles/knead_server.dir/loop.c.o" "gcc" "server/CMakeFiles/knead_server.dir/loop.c.o.d"
  "/tmp/wt/scripts/server/mailbox.c" "server/CMakeFiles/knead_server.dir/mailbox.c.o" "gcc" "server/CMakeFiles/knead_server.dir/mailbox.c.o.d"
  "/tmp/wt/scripts/server/publisher.c" "server/CMakeFiles/knead_server.dir/publisher.c.o" "gcc" "server/CMakeFiles/knead_server.dir/publisher.c.o.d"
  "/tmp/wt/scripts/server/receiver.c" "server/CMakeFiles/knead_server.dir/receiver.c.o" "gcc" "server/CMakeFiles/knead_server.dir/receiver.c.o.d"
  "/tmp/wt/scripts/server/replay.c" "server/CMakeFiles/knead_server.dir/replay.c.o" "gcc" "server/CMakeFiles/knead_server.dir/replay.c.o.d"
  "/tmp/wt/scripts/server/ring.c" "server/CMakeFiles/knead_server.dir/ring.c.o" "gcc" "server/CMakeFiles/knead_server.dir/ring.c.o.d"
  "/tmp/wt/scripts/server/rt.c" "server/CMakeFiles/knead_server.dir/rt.c.o" "gcc" "server/CMakeFiles/knead_server.dir/rt.c.o.d"
  "/tmp/wt/scripts/server/sentinel.c" "server/CMakeFiles/knead_server.dir/sentinel.c.o" "gcc" "server/CMakeFiles/knead_server.dir/sentinel.c.o.d"
  "/tmp/wt/scripts/server/servo.c" "server/CMakeFiles/knead_server.dir/servo.c.o" "gcc" "server/CMakeFiles/knead_server.dir/servo.c.o.d"
  "/tmp/wt/scripts/server/skin.c" "server/CMakeFiles/knead_server.dir/skin.c.o" "gcc" "server/CMakeFiles/knead_server.dir/skin.c.o.d"
  "/tmp/wt/scripts/server/wire.c" "server/CMakeFiles/knead_server.dir/wire.c.o" "gcc" "server/CMakeFiles/knead_server.dir/wire.c.o.d"
  )

# Targets to which this target links.
set(CMAKE_TARGET_LINKED_INFO_FILES
  "/tmp/wt/scripts/core/CMakeFiles/knead_core.dir/DependInfo.cmake"
  "/tmp/wt/scripts/core/scene/CMakeFiles/knead_scene.dir/DependInfo.cmake"
  "/tmp/wt/scripts/proto/CMakeFiles/knead_proto.dir/DependInfo.cmake"
  )

# Fortran module output directory.
set(CMAKE_Fortran_TARGET_MODULE_DIR "")
