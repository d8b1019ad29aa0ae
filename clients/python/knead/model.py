"""Objects in this program: scenes, models, states and batches of states. All numbers are in SI units."""
import ctypes
import os
import shutil
from typing import NamedTuple

import numpy as np

from knead import _api, _library

_core = _library.core
version = _api.KN_VERSION


class Error(ValueError):
    """A scene, model or step that libknead refuses, with its reason in one line."""


def _table(pointer, dtype, *shape):
    """Return an array over memory of the library, without a copy. It must not outlive this memory."""
    address = ctypes.cast(pointer, ctypes.c_void_p).value
    size = int(np.prod(shape)) * np.dtype(dtype).itemsize
    return np.frombuffer((ctypes.c_char * size).from_address(address), dtype).reshape(shape)


def _copied(pointer, dtype, *shape):
    """Return a copy of a table of the library, which nobody can write to."""
    copy = _table(pointer, dtype, *shape).copy()
    copy.flags.writeable = False
    return copy


def _scene_file(name):
    """Return the file of the scene `name` that comes with Knead; return `name` itself if there is no such scene."""
    program = os.path.dirname(os.path.realpath(shutil.which('kneadd') or '/usr/bin/kneadd'))
    places = os.environ.get('KNEAD_SCENES') or f'{program}/../share/knead/scenes', f'{program}/../../../core/scenes'
    return next(filter(os.path.exists, [name, *(f'{place}/{name}.yaml' for place in places)]), name)


class Scene:
    """A scene file, checked and with its defaults.

    path: the file's path, the name of a scene that comes with Knead, such as 'dough', or the scene's YAML text, which
        has at least one line break.
    settings: texts KEY=VALUE as for --set, for example 'object.spacing=5 mm'.
    """

    def __init__(self, path, *settings):
        library, path = _library.scene(), os.fspath(path)
        sets = (ctypes.c_char_p * len(settings))(*(s.encode() for s in settings))
        error = ctypes.create_string_buffer(600)
        self._destroy = library.kn_scene_destroy
        if '\n' in path:
            text = path.encode()
            self._scene = library.kn_scene_parse(b'scene', text, len(text), sets, len(settings), error, len(error))
        else:
            self._scene = library.kn_scene_load(_scene_file(path).encode(), sets, len(settings), error, len(error))
        if not self._scene:
            raise Error(error.value.decode())
        self.name = self._scene.contents.name.decode()
        self.label = self._scene.contents.label.decode()

    @property
    def text(self):
        """The whole scene as YAML in SI units, with every default and every setting."""
        return self._scene.contents.text.decode()

    def __del__(self):
        if getattr(self, '_scene', None):
            self._destroy(self._scene)
            self._scene = None

    def __repr__(self):
        return f'<knead.Scene {self.name}>'


class Model:
    """What does not change while an object is touched.

    scene: a Scene, the path, name or text of one, or None: a block of dough of 5 x 5 x 3 cm under a ball of 3 cm.
    settings: texts KEY=VALUE, as for Scene.
    dt_s: time step, s; None: the scene's. A learner's step is 0.01, and 0.005 halves its error.

    A model, its states and its batches belong to one thread of the program at a time; a batch has threads of its own.
    """

    def __init__(self, scene=None, *settings, dt_s=None):
        if scene is not None and not isinstance(scene, Scene):
            scene = Scene(scene, *settings)
        elif settings:
            raise Error('settings belong to a scene that is given by its path or text')
        self.scene = scene  # owns what the model's definition points to
        definition = scene._scene.contents.model if scene else _core.kn_model_def_default()
        if dt_s is not None:
            copy = type(definition)()
            ctypes.pointer(copy)[0] = definition
            definition, definition.solver.dt_s = copy, dt_s
        error = ctypes.create_string_buffer(600)
        self._model = _core.kn_model_build(ctypes.byref(definition), error, len(error))
        if not self._model:
            raise Error(error.value.decode())
        m = self._model.contents
        self._def = getattr(m, 'def')
        self.nodes = m.node_count
        self.dt_s = self._def.solver.dt_s
        self.tools = tuple(self._def.probe[p].name.decode() for p in range(self._def.probe_count))
        self.mass_kg = _core.kn_model_mass(self._model)
        self.rest_m = _copied(m.rest_m, np.float64, self.nodes, 3)  # positions of the nodes in the undeformed object
        self.top = _copied(m.top, np.int32, m.top_count)  # numbers of the nodes of the top
        self._offset = _table(m.offset, np.uintp, self.nodes)[:, None] + np.arange(3, dtype=np.uintp) * m.stride
        self._real = np.float32 if self._def.solver.precision == _api.KN_PRECISION_F32 else np.float64
        self._surface = _core.kn_surface_create(self._model)
        self._gauge = _core.kn_gauge_create(self._model)
        if not self._surface or not self._gauge:
            raise MemoryError
        s = self._surface.contents
        self.triangles = _copied(s.triangle, np.int32, s.triangle_count, 3)  # of the surface, by vertex

    def state(self):
        """Return an undeformed State of its own."""
        return self.batch(1, threads=1)[0]

    def batch(self, count, threads=1):
        """Return a Batch of `count` undeformed states, stepped by `threads` threads."""
        return Batch(self, count, threads)

    @property
    def state_bytes(self):
        """Memory of a state, bytes."""
        return _core.kn_state_size(self._model)

    def __del__(self):
        if getattr(self, '_model', None):
            _core.kn_surface_destroy(self._surface)
            _core.kn_gauge_destroy(self._gauge)
            _core.kn_model_destroy(self._model)
            self._model = None

    def __repr__(self):
        return f'<knead.Model {self.nodes} nodes, tools {", ".join(self.tools)}>'


def _given(name, text):
    """A property whose array the step reads; to assign to it is to write into this array."""
    def write(self, value):
        self._given[name][...] = value
    return property(lambda self: self._given[name], write, doc=text)


class Batch:
    """States of one model that are stepped together. A state has the same bits for any number of threads.

    N states, P tools. Write before a step (arrays that the step reads; a pose moves with its velocity, so position_m is
    where the tool goes on from):
        attached (N, P) bool, position_m (N, P, 3), velocity_m_s (N, P, 3), orientation_wxyz (N, P, 4), grip (N, P) bool,
        top_load_n (N,)
    Read after a step (arrays that the next step overwrites, and that cannot be written):
        force_n (N, P, 3), torque_n_m (N, P, 3) about the tool's position, tool_m (N, P, 3), work_j (N, P),
        contacts (N, P)
    """

    attached = _given('attached', 'whether each tool is in the model, (N, P) bool')
    grip = _given('grip', 'whether each tool grips the skin that it touches, (N, P) bool')
    position_m = _given('position_m', 'poses, (N, P, 3)')
    velocity_m_s = _given('velocity_m_s', 'velocities of the poses, (N, P, 3)')
    orientation_wxyz = _given('orientation_wxyz', 'orientations of the poses, unit quaternions, (N, P, 4)')
    top_load_n = _given('top_load_n', 'dead load on the top, (N,)')

    def __init__(self, model, count, threads=1):
        self.model, self._count, p = model, count, len(model.tools)
        self._ensemble = _core.kn_ensemble_create(model._model, count, threads)
        if not self._ensemble:
            raise Error('a batch needs count >= 1, threads >= 1 and memory for its states')
        self._in, self._out = (_api.kn_input * count)(), (_api.kn_output * count)()
        self._touch = (_api.kn_touch * _api.KN_PROBES_MAX * count)()
        given, got = np.frombuffer(self._in, _api.kn_input), np.frombuffer(self._out, _api.kn_output)
        self._given = {name: given['probe'][name][:, :p]
                       for name in ('attached', 'grip', 'position_m', 'velocity_m_s', 'orientation_wxyz')}
        self._given['top_load_n'] = given['top_load_n']
        self.orientation_wxyz[..., 0] = 1
        self._got = got
        got = got.view()
        got.flags.writeable = False
        self.force_n, self.torque_n_m = got['probe']['force_n'][:, :p], got['probe']['torque_n_m'][:, :p]
        self.tool_m, self.work_j = got['probe']['position_m'][:, :p], got['probe']['work_j'][:, :p]
        self.contacts = got['probe']['contacts'][:, :p]
        self._states = [_core.kn_ensemble_state(self._ensemble, i) for i in range(count)]
        m = model._model.contents
        reals = m.row_count * 3 * m.stride
        self._moved = [_table(s.contents.displacement, model._real, reals) for s in self._states]

    def step(self, steps=1):
        """Take `steps` time steps of all states. Raise Error if an object has diverged; its forces are 0 then."""
        if steps < 1:
            raise Error(f'{steps} steps, expected at least 1')
        status = _core.kn_ensemble_step(self._ensemble, steps, self._in, self._out, self._touch)
        way = self.model.dt_s * self.velocity_m_s
        for _ in range(steps):  # one by one, as the steps have added them: the same bits
            self.position_m += way
        if status != _api.KN_OK:
            bad = [i for i, s in enumerate(self._states) if s.contents.bad]
            raise Error(f'{_core.kn_status_text(status).decode()} (states {bad})')

    def reset(self, numbers=None):
        """Put the states `numbers` back to the undeformed object; None: all. Their tools are detached and at rest."""
        for i in range(self._count) if numbers is None else numbers:
            _core.kn_state_reset(self.model._model, self._states[i])
            self._forget(i)
            self.attached[i], self.velocity_m_s[i] = False, 0

    def _forget(self, i):
        """Forget what the last step of a state gave: it was of another object."""
        self._got[i] = np.zeros((), self._got.dtype)
        ctypes.memset(self._touch[i], 0, ctypes.sizeof(self._touch[i]))

    def positions_m(self):
        """Present positions of the nodes, (N, nodes, 3)."""
        return np.stack([self.model.rest_m + m[self.model._offset] for m in self._moved])

    def top_m(self):
        """Present heights of the nodes model.top, (N, top)."""
        at, rest = self.model._offset[self.model.top, 2], self.model.rest_m[self.model.top, 2]
        return np.stack([rest + m[at] for m in self._moved])

    def hash(self):
        """64-bit hash of each state, the same on every machine, (N,)."""
        return np.array([_core.kn_state_hash(self.model._model, s) for s in self._states], np.uint64)

    def __len__(self):
        return self._count

    def __getitem__(self, number):
        return State(self, range(self._count)[number])

    def __del__(self):
        if getattr(self, '_ensemble', None):
            _core.kn_ensemble_destroy(self._ensemble)
            self._ensemble = None


class Touch(NamedTuple):
    """The contact of one tool in the last step, in the tool's frame; all 0: nothing touches (core/touch.h)."""
    area_m2: float
    centre_m: np.ndarray  # (3,) centre of pressure
    normal: np.ndarray  # (3,) mean normal out of the object
    peak_pressure_pa: float
    slip_velocity_m_s: np.ndarray  # (3,) of the skin on the tool
    pressure_pa: np.ndarray  # (8, 8) map over the tool's face


def _pose(name, size):
    """A property of a Tool: a row of the batch's array of that name."""
    def read(self):
        return getattr(self._batch, name)[self._state, self._number]

    def write(self, value):
        getattr(self._batch, name)[self._state, self._number] = value
        if name == 'position_m':
            self.attached = True
    return property(read, write, doc=f'{name}, ({size},). Assigning it attaches the tool; writing one number does not.'
                    if name == 'position_m' else f'{name}, ({size},)' if size else name)


class Tool:
    """One tool of one state. Poses are written before a step, forces read after it.

    position_m, velocity_m_s and orientation_wxyz are views of what the next step reads: a step moves position_m.
    """

    def __init__(self, batch, state, number):
        self._batch, self._state, self._number = batch, state, number

    attached, grip = _pose('attached', 0), _pose('grip', 0)
    position_m, velocity_m_s = _pose('position_m', 3), _pose('velocity_m_s', 3)
    orientation_wxyz = _pose('orientation_wxyz', 4)
    force_n = property(lambda self: self._batch.force_n[self._state, self._number].copy(),
                       doc='force of the object on the tool, (3,)')
    torque_n_m = property(lambda self: self._batch.torque_n_m[self._state, self._number].copy(),
                          doc="torque of the object on the tool, about the tool's position, (3,)")
    work_j = property(lambda self: float(self._batch.work_j[self._state, self._number]),
                      doc='work of the tool on the object since the tool was attached')
    contacts = property(lambda self: int(self._batch.contacts[self._state, self._number]),
                        doc='number of nodes or samples that carry load')

    def touch(self):
        """The contact of the last step, a Touch."""
        t = self._batch._touch[self._state][self._number]
        return Touch(*(np.array(v) if hasattr(v := getattr(t, name), '__len__') else v for name in Touch._fields))


class State:
    """One object: model.state(), or batch[i]. state['finger'] is its Tool of that name."""

    def __init__(self, batch, number):
        self._batch, self._number, self.model = batch, number, batch.model
        self._state = batch._states[number]

    def __getitem__(self, tool):
        if tool not in self.model.tools:
            raise KeyError(f'{tool!r}, expected one of {", ".join(self.model.tools) or "no tools"}')
        return Tool(self._batch, self._number, self.model.tools.index(tool))

    def step(self, steps=1):
        """Take time steps; the poses move with their velocities. A state of a batch steps with its batch."""
        if len(self._batch) != 1:
            raise Error('a state of a batch steps with its batch: batch.step()')
        self._batch.step(steps)

    def reset(self):
        """Put the object back to its undeformed state and detach the tools."""
        self._batch.reset([self._number])

    @property
    def tick(self):
        """Number of steps since the last reset."""
        return self._state.contents.tick

    def hash(self):
        """64-bit hash of the state, the same on every machine."""
        return _core.kn_state_hash(self.model._model, self._state)

    def positions_m(self):
        """Present positions of the nodes, (nodes, 3)."""
        return self.model.rest_m + self._batch._moved[self._number][self.model._offset]

    def surface_m(self):
        """Present positions of the surface's vertices, (vertices, 3) float32; model.triangles joins them."""
        s = self.model._surface
        xyz = np.empty((s.contents.vertex_count, 3), np.float32)
        _core.kn_surface_positions(s, self.model._model, self._state, xyz.ctypes.data_as(_api.POINTER(_api.c_float)))
        return xyz

    def _measure(self, what):
        value = np.empty(self.model.nodes)
        _core.kn_gauge_read(self.model._gauge, self._state, what, value.ctypes.data_as(_api.POINTER(_api.c_double)))
        return value

    def stress_pa(self):
        """Von Mises stress of each node, (nodes,)."""
        return self._measure(_api.KN_MEASURE_STRESS)

    def residual_strain(self):
        """Permanent strain of each node, (nodes,): what stays when the tools leave."""
        return self._measure(_api.KN_MEASURE_RESIDUAL)

    def snapshot(self):
        """The state as bytes, for restore() of a state of the same model."""
        m = self.model._model
        bytes_ = (ctypes.c_uint8 * _core.kn_snapshot_size(m, self._state))()
        _core.kn_snapshot_write(m, self._state, bytes_, len(bytes_))
        return bytes(bytes_)

    def restore(self, snapshot):
        """Take over a snapshot. Raise Error, and reset the object, if it does not fit the model."""
        bytes_ = (ctypes.c_uint8 * len(snapshot)).from_buffer_copy(snapshot)
        self._batch._forget(self._number)
        fit = _core.kn_snapshot_read(self.model._model, bytes_, len(snapshot), self._state)
        if fit != _api.KN_SNAPSHOT_FITS:
            self.reset()
            raise Error(f'the snapshot does not fit: {_core.kn_snapshot_fit_name(fit).decode()}')

    def __repr__(self):
        return f'<knead.State after {self.tick} steps>'
