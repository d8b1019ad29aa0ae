file(REMOVE_RECURSE
  "../bin/bench_view"
  "../bin/bench_view.pdb"
  "CMakeFiles/bench_view.dir/bench_view.c.o"
  "CMakeFiles/bench_view.dir/bench_view.c.o.d"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/bench_view.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
