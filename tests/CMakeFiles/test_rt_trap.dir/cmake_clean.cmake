file(REMOVE_RECURSE
  "CMakeFiles/test_rt_trap.dir/rt/test_trap.c.o"
  "CMakeFiles/test_rt_trap.dir/rt/test_trap.c.o.d"
  "test_rt_trap"
  "test_rt_trap.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_rt_trap.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
