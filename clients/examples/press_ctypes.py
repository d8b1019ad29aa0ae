# Press a ball into dough, wait and lift it, by Python's ctypes alone; press.c and press.py do the same.
from ctypes import *

lib = CDLL('libknead.so.0.1')
double3, double4 = c_double * 3, c_double * 4


class ProbeInput(Structure):
    _fields_ = [('attached', c_bool), ('position_m', double3), ('velocity_m_s', double3),
                ('orientation_wxyz', double4), ('grip', c_bool)]


class Input(Structure):
    _fields_ = [('probe', ProbeInput * 4), ('top_load_n', c_double), ('effort', c_int64 * 3), ('deadline', c_int64)]


class ProbeOutput(Structure):
    _fields_ = [('force_n', double3), ('torque_n_m', double3), ('position_m', double3),
                ('orientation_wxyz', double4), ('work_j', c_double), ('contacts', c_int)]


class Output(Structure):
    _fields_ = [('probe', ProbeOutput * 4), ('step', c_int64 * 4)]


for name in ('kn_model_build', 'kn_state_create', 'kn_scratch_create'):
    getattr(lib, name).restype = c_void_p
lib.kn_state_hash.restype = c_uint64
lib.kn_status_text.restype = c_char_p

error = create_string_buffer(200)
model = c_void_p(lib.kn_model_build(None, error, c_size_t(200)))  # a block of dough 3 cm high, and a ball of 3 cm
state = c_void_p(lib.kn_state_create(model))
scratch = c_void_p(lib.kn_scratch_create(model))
into, out = Input(), Output()
ball = into.probe[0]
ball.attached = True
ball.position_m[2] = 0.045  # the ball's lowest point is on the dough
for ms in range(1, 1501):
    ball.velocity_m_s[2] = -0.01 if ms <= 500 else 0 if ms <= 1000 else 0.01
    status = lib.kn_step(model, state, scratch, byref(into), byref(out))
    if status != 0:
        raise SystemExit(lib.kn_status_text(status).decode())
    ball.position_m[2] += 0.001 * ball.velocity_m_s[2]
    if ms % 50 == 0:
        print('%4d ms  %.17g N' % (ms, out.probe[0].force_n[2]))
print('hash %016x' % lib.kn_state_hash(model, state))
