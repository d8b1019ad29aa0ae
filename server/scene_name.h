#ifndef KN_SERVER_SCENE_NAME_H
#define KN_SERVER_SCENE_NAME_H
// Scenes by name. Wherever a command takes a scene, `dough` means the scene of that name that comes with Knead.

// Return the folder of the scenes that come with Knead: KNEAD_SCENES of the environment, else share/knead/scenes of the
// installation or core/scenes of the source tree that this program belongs to. Return NULL if there is no such folder.
const char *kn_scene_folder(void);

// Set *path, a const char *, to the scene that `text` means: the file with this path, or NAME.yaml in kn_scene_folder.
// A missing path with a '/' or '.' is kept, because reading it gives the better message. If the name is unknown, set
// *path to `text` and return the text after "expected" in a message, which lists the names. The returned texts are valid
// until the process ends, but only those of the last 8 calls. For kn_option.take.
const char *kn_scene_take(void *path, const char *text);

#endif
