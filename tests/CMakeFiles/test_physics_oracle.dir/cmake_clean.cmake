file(REMOVE_RECURSE
  "CMakeFiles/test_physics_oracle.dir/physics/test_oracle.c.o"
  "CMakeFiles/test_physics_oracle.dir/physics/test_oracle.c.o.d"
  "test_physics_oracle"
  "test_physics_oracle.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_physics_oracle.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
