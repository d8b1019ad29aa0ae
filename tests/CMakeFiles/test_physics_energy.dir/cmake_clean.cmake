file(REMOVE_RECURSE
  "CMakeFiles/test_physics_energy.dir/physics/test_energy.c.o"
  "CMakeFiles/test_physics_energy.dir/physics/test_energy.c.o.d"
  "test_physics_energy"
  "test_physics_energy.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_physics_energy.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
