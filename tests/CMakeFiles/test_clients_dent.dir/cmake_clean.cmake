file(REMOVE_RECURSE
  "CMakeFiles/test_clients_dent.dir/clients/test_dent.c.o"
  "CMakeFiles/test_clients_dent.dir/clients/test_dent.c.o.d"
  "test_clients_dent"
  "test_clients_dent.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_clients_dent.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
