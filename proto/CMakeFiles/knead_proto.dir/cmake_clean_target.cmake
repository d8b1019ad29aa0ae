file(REMOVE_RECURSE
  "libknead_proto.a"
)
