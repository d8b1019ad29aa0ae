file(REMOVE_RECURSE
  "../bin/bench_step"
  "../bin/bench_step.pdb"
  "CMakeFiles/bench_step.dir/bench_step.c.o"
  "CMakeFiles/bench_step.dir/bench_step.c.o.d"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/bench_step.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
