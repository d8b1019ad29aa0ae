# Press a ball into dough, wait and lift it; press.c does the same.
import knead

state = knead.Model().state()  # a block of dough 3 cm high, and a ball of 3 cm
ball = state['finger']
ball.position_m = 0, 0, 0.045  # the ball's lowest point is on the dough
for ms in range(1, 1501):
    ball.velocity_m_s[2] = -0.01 if ms <= 500 else 0 if ms <= 1000 else 0.01
    state.step()
    if ms % 50 == 0:
        print('%4d ms  %.17g N' % (ms, ball.force_n[2]))
print('hash %016x' % state.hash())
