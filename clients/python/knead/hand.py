"""A hand of a running kneadd, over UDP and with Python's standard library alone: poses out, forces in, 1000 a second."""
import hashlib
import os
import re
import secrets
import select
import socket
import struct
import time
from urllib.parse import parse_qs, urlparse

from knead.wire.contact_force_t import contact_force_t
from knead.wire.probe_pose_t import probe_pose_t

HOLD_S, ZERO_S, SILENCE_S = 0.003, 0.020, 1.2  # the watchdog: hold a force, fade it to 0 N, then send no poses
_SMALL = 0x4c433032  # LCM's mark of a message of one datagram


class _Key:
    """Signatures of kneadd --key (proto/README.md, "Trailer")."""

    def __init__(self, path):
        with open(path, encoding='ascii') as file:
            owner, text = os.fstat(file.fileno()), file.read().strip()
        if owner.st_uid not in (0, os.getuid()) or owner.st_mode & 0o077:
            raise ValueError(f'{path}: expected a key of this user or of root that nobody else may read: chmod 600')
        if not re.fullmatch('[0-9a-fA-F]{64}', text):
            raise ValueError(f'{path}: expected 64 hexadecimal digits')
        self.key = bytes.fromhex(text)
        self.life = self.ahead_us = self.last_us = self.sent_us = self.said = self.asked = self.believed = 0
        self.nonce = b''

    def sign(self, channel, payload, life, age_us):
        payload += struct.pack('>qq', life, age_us)
        return payload + hashlib.blake2b(channel + b'\0' + payload, key=self.key, digest_size=16).digest()

    def hello(self, now):
        """Return the payload of a hello if one is due, else None."""
        if now - max(self.said, self.believed) < (0.25 if self.life else 0.05):
            return None
        if not self.nonce or now - self.asked > 1:
            self.asked, self.nonce = now, secrets.token_bytes(8)
        self.said = now
        return self.sign(b'KNEAD_HELLO', self.nonce, 0, 0)

    def stamp(self, channel, payload, now):
        """Return the payload with the trailer of this moment, or None while kneadd has not answered."""
        if not self.life:
            return None
        self.sent_us = max(self.sent_us + 1, int(now * 1e6) + self.ahead_us)
        return self.sign(channel, payload, self.life, self.sent_us)

    def believe(self, channel, message, now):
        """Return whether a message is kneadd's and newer than the last one. An answer to a hello begins a life."""
        life, age_us = struct.unpack('>qq', message[-32:-16]) if len(message) > 32 else (0, 0)
        if life == 0 or not secrets.compare_digest(self.sign(channel, message[:-32], life, age_us), message):
            return False
        ahead_us = age_us - int(now * 1e6)
        if channel == b'KNEAD_LIFE' and self.nonce and message[:-32] == self.nonce:
            if life != self.life:
                self.last_us, self.sent_us = age_us, 0
            self.life, self.ahead_us, self.believed, self.nonce = life, ahead_us, now, b''
            return False
        if life != self.life or age_us <= self.last_us:
            return False
        # a message that has waited in a buffer gives too low an age, so the estimate falls slowly
        self.last_us, self.believed, self.ahead_us = age_us, now, max(ahead_us, self.ahead_us - 200)
        return True


class Hand:
    """A hand that holds a tool of a running kneadd.

        with knead.Hand('finger') as hand:
            while True:
                force_n = hand.move((x, y, z), (vx, vy, vz))     # waits for the next millisecond

    tool: the tool's name in kneadd's scene.
    lan: a network interface, for a kneadd --lan on another machine; None: this machine.
    key: path of the key file of kneadd --key.
    period_s: time between two poses, at most 0.01; kneadd lets go of a tool after 0.02 s without poses.
    """

    def __init__(self, tool='finger', lan=None, key=None, period_s=0.001):
        if not 0 < period_s <= 0.01:
            raise ValueError(f'period_s is {period_s}, expected more than 0 and at most 0.01')
        if lan and not key:
            raise ValueError('lan without key: kneadd takes no unsigned pose from a network')
        url = urlparse(os.environ.get('LCM_DEFAULT_URL') or 'udpm://239.255.76.67:7667?ttl=0')
        self._to = (url.hostname or '239.255.76.67', url.port or 7667)
        ttl = 1 if lan else int(parse_qs(url.query).get('ttl', ['0'])[0])
        self._pose, self._channel = probe_pose_t(), f'KNEAD_POSE_{tool}'.encode()
        self._force_channel = f'KNEAD_FORCE_{tool}'.encode()
        self._key = _Key(key) if key else None
        self._period_s, self._next, self._count = period_s, time.monotonic(), 0
        self._wall_us = int((time.time() - self._next) * 1e6)  # read once: a clock set back would end the session
        self._begin_session()
        index = socket.if_nametoindex(lan) if lan else 0
        member = struct.pack('=4s4si', socket.inet_aton(self._to[0]), b'\0\0\0\0', index)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            for option in (socket.SO_REUSEADDR, socket.SO_REUSEPORT):
                self._socket.setsockopt(socket.SOL_SOCKET, option, 1)
            self._socket.bind(self._to)
            self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, member)
            self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, ttl)
            if lan:
                self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, member)
            self._socket.setblocking(False)
        except OSError as error:
            self._socket.close()
            raise OSError(f'no LCM on {self._to[0]}:{self._to[1]}: {error.strerror}; is there a multicast route?') from None

    def _begin_session(self):
        self._pose.session, self._pose.orientation_wxyz = secrets.randbits(62) + 1, (1, 0, 0, 0)
        self._heard, self._silent_until = None, 0
        self.message = None  # newest contact_force_t of this session

    def _send(self, channel, payload):
        if payload is None:
            return
        self._count += 1
        try:
            self._socket.sendto(struct.pack('>II', _SMALL, self._count) + channel + b'\0' + payload, self._to)
        except OSError:
            pass  # a pose that is not sent is a pose lost: the watchdogs of both sides see to it

    def _receive(self):
        while select.select([self._socket], [], [], 0)[0]:
            data = self._socket.recv(65536)
            end = data.find(b'\0', 8)
            if end < 0 or struct.unpack('>I', data[:4])[0] != _SMALL:
                continue
            channel, message, now = data[8:end], data[end + 1:], time.monotonic()
            if channel not in (self._force_channel, b'KNEAD_LIFE'):
                continue
            if self._key and not self._key.believe(channel, message, now) or channel == b'KNEAD_LIFE':
                continue
            try:
                force = contact_force_t.decode(message)
            except (ValueError, struct.error):
                continue
            again = self.message and force.tick <= self.message.tick  # a repeated force does not reset its age
            if force.session == self._pose.session and not again:
                self.message, self._heard = force, now

    def move(self, position_m, velocity_m_s=(0, 0, 0), orientation_wxyz=(1, 0, 0, 0), grip=False):
        """Wait for the next period, send a pose and return the force on the hand, (3,) N in the scene's frame.

        The force is 0 while kneadd is silent, latched or not there; trouble() has the reason.
        """
        self._next = max(self._next + self._period_s, time.monotonic() - self._period_s)
        time.sleep(max(0, self._next - time.monotonic()))
        now = time.monotonic()
        if self._key:
            self._send(b'KNEAD_HELLO', self._key.hello(now))
        if self._silent_until and now >= self._silent_until:
            self._begin_session()
        if not self._silent_until:
            p = self._pose
            p.position_m, p.velocity_m_s, p.orientation_wxyz = position_m, velocity_m_s, orientation_wxyz
            p.buttons, p.seq = 2 if grip else 0, p.seq + 1
            self._publish(now)
        self._receive()
        age = time.monotonic() - self._heard if self._heard else ZERO_S
        if self._heard and age >= ZERO_S and not self._silent_until:
            self._silent_until = now + SILENCE_S
        if self._silent_until or age >= ZERO_S:
            return (0.0, 0.0, 0.0)
        factor = min(1.0, (ZERO_S - age) / (ZERO_S - HOLD_S))
        return tuple(factor * f for f in self.message.force_n)

    def _publish(self, now):
        p = self._pose
        p.sent_ns, p.utime = time.monotonic_ns(), self._wall_us + int(now * 1e6)
        payload = p.encode()
        self._send(self._channel, self._key.stamp(self._channel, payload, now) if self._key else payload)

    def trouble(self):
        """Return why there is no force, or will soon be none, or ''."""
        if self._silent_until or not self._heard or time.monotonic() - self._heard >= ZERO_S:
            return 'no force from kneadd: is it running?'
        if self.message.flags & contact_force_t.FLAG_LATCHED:
            return 'latched: lift the tool off the object'
        return ''

    def close(self):
        """Say that the hand leaves: its force fades without a fault, and the tool is free at once."""
        if self._socket.fileno() < 0:
            return
        if self._heard and not self._silent_until:
            self._pose.buttons, self._pose.seq = probe_pose_t.BUTTON_LEAVING, self._pose.seq + 1
            self._publish(time.monotonic())
        self._socket.close()

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.close()
