file(REMOVE_RECURSE
  "libknead_viewer.a"
)
