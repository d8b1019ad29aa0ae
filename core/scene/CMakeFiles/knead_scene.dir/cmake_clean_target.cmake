file(REMOVE_RECURSE
  "libknead_scene.a"
)
