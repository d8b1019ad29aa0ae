file(REMOVE_RECURSE
  "CMakeFiles/test_core_solver_rk4.dir/core/test_solver_rk4.c.o"
  "CMakeFiles/test_core_solver_rk4.dir/core/test_solver_rk4.c.o.d"
  "test_core_solver_rk4"
  "test_core_solver_rk4.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_core_solver_rk4.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
