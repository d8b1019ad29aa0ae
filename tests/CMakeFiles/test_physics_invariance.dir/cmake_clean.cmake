file(REMOVE_RECURSE
  "CMakeFiles/test_physics_invariance.dir/physics/test_invariance.c.o"
  "CMakeFiles/test_physics_invariance.dir/physics/test_invariance.c.o.d"
  "test_physics_invariance"
  "test_physics_invariance.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_physics_invariance.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
