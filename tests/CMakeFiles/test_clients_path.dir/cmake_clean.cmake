file(REMOVE_RECURSE
  "CMakeFiles/test_clients_path.dir/clients/test_path.c.o"
  "CMakeFiles/test_clients_path.dir/clients/test_path.c.o.d"
  "test_clients_path"
  "test_clients_path.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_clients_path.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
