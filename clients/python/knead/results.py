"""What kneadd and knead leave behind: logs as tables, fits of measured curves."""
import importlib
import json
import re
import struct
import subprocess

_TYPES = (('KNEAD_POSE_', 'probe_pose_t'), ('KNEAD_FORCE_', 'contact_force_t'), ('KNEAD_TOUCH_', 'touch_patch_t'),
          ('KNEAD_CONTACT_', 'contact_model_t'), ('KNEAD_EVENT', 'event_t'), ('KNEAD_SCENE', 'scene_t'),
          ('KNEAD_STATUS', 'status_t'), ('KNEAD_HEALTH', 'health_t'), ('KNEAD_MESH_INIT', 'mesh_init_t'),
          ('KNEAD_MESH_UPDATE', 'mesh_update_t'))


def _events(path):
    """Yield time (us), channel and payload of each event of an LCM log."""
    with open(path, 'rb') as file:
        while head := file.read(28):
            mark, _, utime, channel, size = struct.unpack('>IqqII', head) if len(head) == 28 else (0, 0, 0, 0, 0)
            name, data = file.read(channel), file.read(size)
            if mark != 0xEDA1DA01 or len(name) < channel or len(data) < size:
                raise ValueError(f'{path}: damaged at byte {file.tell()}, expected an event of an LCM log')
            yield utime, name.decode(), data


def _table(kind, rows):
    """Return messages as a structured array if all their fields are numbers of fixed shape, else as a list."""
    import numpy as np
    fields = []
    for name in kind.__slots__:
        value = np.asarray(getattr(rows[0][1], name))
        if value.dtype.kind not in 'bif' or any(np.shape(getattr(m, name)) != value.shape for _, m in rows):
            return [m for _, m in rows]
        fields.append((name, np.int64 if value.dtype.kind == 'i' else value.dtype, value.shape))
    return np.array([(t, *(getattr(m, name) for name in kind.__slots__)) for t, m in rows], [('log_utime', 'i8')] + fields)


def read_log(path, *channels):
    """Read a log of kneadd (lcm-logger, knead probe --record) into a dict from channel to table.

    path: the log. channels: names to read, for example 'KNEAD_FORCE_finger'; none: all of Knead's.
    A table is a numpy structured array with one row for each message: 'log_utime' (us, when it was logged) and the
    message's fields, which proto/*.lcm describes: log['KNEAD_FORCE_finger']['contact_force_n'] has the shape (n, 3).
    Messages with texts or with arrays of changing size are a list of objects.
    """
    rows = {}
    for utime, channel, data in _events(path):
        kind = next((k for prefix, k in _TYPES if channel.startswith(prefix)), None)
        if kind is None or channels and channel not in channels:
            continue
        kind = getattr(importlib.import_module('knead.wire.' + kind), kind)
        rows.setdefault((channel, kind), []).append((utime, kind.decode(data)))
    return {channel: _table(kind, messages) for (channel, kind), messages in rows.items()}


def identify(experiment, *arguments, knead='knead'):
    """Fit a material to measured curves with `knead identify EXPERIMENT ARGUMENTS --json`, and return its result, a dict.

    experiment: 'creep', 'relax', 'press' or 'sweep'. arguments: files and options of that command.
    knead: the program. Raise ValueError with its message if it refuses.
    """
    run = subprocess.run([knead, 'identify', experiment, *map(str, arguments), '--json'], capture_output=True, text=True)
    if run.returncode:
        raise ValueError(re.sub(r'\s+', ' ', run.stderr or run.stdout).strip())
    return json.loads(run.stdout)
