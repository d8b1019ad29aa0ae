file(REMOVE_RECURSE
  "CMakeFiles/test_clients_hand.dir/clients/test_hand.c.o"
  "CMakeFiles/test_clients_hand.dir/clients/test_hand.c.o.d"
  "test_clients_hand"
  "test_clients_hand.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_clients_hand.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
