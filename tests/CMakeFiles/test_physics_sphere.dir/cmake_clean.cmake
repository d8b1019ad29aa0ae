file(REMOVE_RECURSE
  "CMakeFiles/test_physics_sphere.dir/physics/test_sphere.c.o"
  "CMakeFiles/test_physics_sphere.dir/physics/test_sphere.c.o.d"
  "test_physics_sphere"
  "test_physics_sphere.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_physics_sphere.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
