file(REMOVE_RECURSE
  "CMakeFiles/knead_cli.dir/knead/check.c.o"
  "CMakeFiles/knead_cli.dir/knead/check.c.o.d"
  "CMakeFiles/knead_cli.dir/knead/dent.c.o"
  "CMakeFiles/knead_cli.dir/knead/dent.c.o.d"
  "CMakeFiles/knead_cli.dir/knead/device.c.o"
  "CMakeFiles/knead_cli.dir/knead/device.c.o.d"
  "CMakeFiles/knead_cli.dir/knead/hand.c.o"
  "CMakeFiles/knead_cli.dir/knead/hand.c.o.d"
  "CMakeFiles/knead_cli.dir/knead/join.c.o"
  "CMakeFiles/knead_cli.dir/knead/join.c.o.d"
  "CMakeFiles/knead_cli.dir/knead/live.c.o"
  "CMakeFiles/knead_cli.dir/knead/live.c.o.d"
  "CMakeFiles/knead_cli.dir/knead/path.c.o"
  "CMakeFiles/knead_cli.dir/knead/path.c.o.d"
  "CMakeFiles/knead_cli.dir/knead/path_csv.c.o"
  "CMakeFiles/knead_cli.dir/knead/path_csv.c.o.d"
  "CMakeFiles/knead_cli.dir/knead/probe.c.o"
  "CMakeFiles/knead_cli.dir/knead/probe.c.o.d"
  "CMakeFiles/knead_cli.dir/knead/probe_options.c.o"
  "CMakeFiles/knead_cli.dir/knead/probe_options.c.o.d"
  "CMakeFiles/knead_cli.dir/knead/record.c.o"
  "CMakeFiles/knead_cli.dir/knead/record.c.o.d"
  "CMakeFiles/knead_cli.dir/knead/replay.c.o"
  "CMakeFiles/knead_cli.dir/knead/replay.c.o.d"
  "CMakeFiles/knead_cli.dir/knead/report.c.o"
  "CMakeFiles/knead_cli.dir/knead/report.c.o.d"
  "CMakeFiles/knead_cli.dir/knead/view.c.o"
  "CMakeFiles/knead_cli.dir/knead/view.c.o.d"
  "libknead_cli.a"
  "libknead_cli.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/knead_cli.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
