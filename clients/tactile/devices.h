#ifndef KN_CLIENTS_DEVICES_H
#define KN_CLIENTS_DEVICES_H
// Search for haptic devices on this machine. No serial line is opened, because opening resets many boards.
//
//     looked at                   checked                                  command to use what is found
//     spacenavd's socket          accepts a connection                     knead hand spacenav
//     the Inverse Service         accepts a connection                     knead hand haply
//     /dev/ttyACM*, /dev/ttyUSB*  name of the device (/sys), permission    knead hand paddle --tty
//     USB devices in /sys         the maker's library, permission          knead hand forcedimension, touch
#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>

// KN_DEVICES_MAX: largest number of devices in a list. KN_DEVICES_TEXT: size of each text of an entry, bytes.
#define KN_DEVICES_MAX 64
#define KN_DEVICES_TEXT 192

typedef struct kn_found {
    char kind[16];                 // kind of the device: "spacenavd", "haply", "tty" or "usb"
    char where[KN_DEVICES_TEXT];   // where the device was found: socket, address, device file, or place on the USB bus
    char usb[10];                  // USB vendor and product ids such as "2341:0043"; "": not a USB device
    char name[KN_DEVICES_TEXT];    // name that the device reports, printable characters only
    bool ready;                    // the device can be used at once
    char use[KN_DEVICES_TEXT];     // command that uses the device
    const char *profile;           // profile that suits the device, for `device:` in a scene; NULL: not determined
    char missing[KN_DEVICES_TEXT]; // reason why the device is not ready; "": it is ready
    char fix[KN_DEVICES_TEXT];     // what the user can do to make the device ready
} kn_found;

// Search for devices, fill in the array `found` of KN_DEVICES_MAX elements, and return the number of devices in it. If
// there are more devices, leave them out. root: "", or a folder whose subfolders dev and sys are searched instead of
// /dev and /sys.
int kn_devices_find(const char *root, kn_found *found);

// Read the first line of a file, without its end. Return false if the file cannot be read or is empty.
bool kn_devices_read_line(const char *path, char *line, size_t size);

// Print a JSON object that has `list` as the value of the name `key`. Free `list`. Return KN_EXIT_OK. If memory is
// short, print an error message that begins with the name of the command, and return KN_EXIT_INTERNAL.
int kn_devices_print(const char *command, const char *key, json_t *list);

#endif
