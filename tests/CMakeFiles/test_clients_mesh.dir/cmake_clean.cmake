file(REMOVE_RECURSE
  "CMakeFiles/test_clients_mesh.dir/clients/test_mesh.c.o"
  "CMakeFiles/test_clients_mesh.dir/clients/test_mesh.c.o.d"
  "test_clients_mesh"
  "test_clients_mesh.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_clients_mesh.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
