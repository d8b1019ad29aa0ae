file(REMOVE_RECURSE
  "CMakeFiles/test_physics_stability.dir/physics/test_stability.c.o"
  "CMakeFiles/test_physics_stability.dir/physics/test_stability.c.o.d"
  "test_physics_stability"
  "test_physics_stability.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_physics_stability.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
