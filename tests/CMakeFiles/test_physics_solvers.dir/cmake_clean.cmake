file(REMOVE_RECURSE
  "CMakeFiles/test_physics_solvers.dir/physics/test_solvers.c.o"
  "CMakeFiles/test_physics_solvers.dir/physics/test_solvers.c.o.d"
  "test_physics_solvers"
  "test_physics_solvers.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_physics_solvers.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
