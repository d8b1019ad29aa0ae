file(REMOVE_RECURSE
  "CMakeFiles/test_physics_materials.dir/physics/test_materials.c.o"
  "CMakeFiles/test_physics_materials.dir/physics/test_materials.c.o.d"
  "test_physics_materials"
  "test_physics_materials.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_physics_materials.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
