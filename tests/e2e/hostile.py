# hostile.py record FILE SECONDS      record the messages on both ports
# hostile.py send FILE[,FILE] COUNT SEED [replay]      send to all listeners datagrams that no client should accept,
# 20 000 a second
#
# The kinds take turns. Parts of a message (LC03) have offsets that wrap, interleaved numbers and wrong sizes. Channel
# names have 0 to 1 000 bytes, with and without their NUL. Recorded messages have flipped bits, are cut, come on
# another channel, or have wrong counts. With `replay` recorded messages are also sent unchanged.
import pickle, random, select, socket, struct, sys, time

GROUP, PORTS = '239.255.76.67', (7667, 7668)
CHANNELS = [b'KNEAD_FORCE_finger', b'KNEAD_CONTACT_finger', b'KNEAD_TOUCH_finger', b'KNEAD_POSE_finger', b'KNEAD_SCENE',
            b'KNEAD_STATUS', b'KNEAD_HEALTH', b'KNEAD_EVENT', b'KNEAD_MESH_INIT', b'KNEAD_MESH_UPDATE', b'KNEAD_LIFE', b'KNEAD_HELLO']


def listen(port):
    s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    s.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    s.bind((GROUP, port))
    s.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, socket.inet_aton(GROUP) + socket.inet_aton('127.0.0.1'))
    return s


def record(path, seconds):
    ears = {listen(port): port for port in PORTS}
    heard, end = {}, time.time() + seconds
    while time.time() < end:
        for ear in select.select(list(ears), [], [], 0.2)[0]:
            bytes_ = ear.recv(65536)
            channel = bytes_[8:bytes_.index(0, 8)]
            heard.setdefault(channel, []).append((ears[ear], bytes_))
    messages = [m for list_ in heard.values() for m in list_[-40:]]
    pickle.dump(messages, open(path, 'wb'))
    print(f'{len(messages)} messages on {len(heard)} channels')


def lc03(number, whole, offset, part, parts, channel, data):
    return b'LC03' + struct.pack('>IIIHH', number, whole, offset, part, parts) + (channel + b'\0' if part == 0 else b'') + data


def odd_parts(dice):
    channel = dice.choice(CHANNELS)
    number, whole = dice.randrange(4), dice.choice((0, 1, 100, 1000, 70000, 1 << 24, (1 << 24) + 1, 1 << 31, (1 << 32) - 1))
    offset = dice.choice((0, 0, 84, 100, whole, whole - 1, 0xfffffff0, 0xffffff00, dice.randrange(1 << 32))) & 0xffffffff
    return lc03(number, whole, offset, dice.choice((0, 0, 1, 1, 2, 65535)), dice.choice((0, 1, 2, 3, 65535)), channel,
                dice.randbytes(dice.choice((0, 16, 84, 100, 512, 1400))))


def odd_name(dice):
    name = bytes(dice.choice(b'KNEAD_FORC%\x1b\0') for _ in range(dice.randrange(1001)))
    return b'LC02\0\0\0\0' + dice.choice((name, name + b'\0' + dice.randbytes(dice.randrange(300)), dice.choice(CHANNELS)))


def spoilt(dice, message):
    end = message.index(0, 8)
    head, payload = message[:end + 1], bytearray(message[end + 1:])
    kind = dice.randrange(4)
    if kind == 0 and payload:
        for _ in range(dice.randrange(1, 9)):
            payload[dice.randrange(len(payload))] ^= 1 << dice.randrange(8)
    elif kind == 1:
        payload = payload[:dice.randrange(len(payload) + 1)]
    elif kind == 2:
        head = head[:8] + dice.choice(CHANNELS) + b'\0'
    else:  # replace a count somewhere in the first hundred bytes
        at = dice.randrange(8, max(9, min(len(payload) - 4, 100)))
        payload[at:at + 4] = struct.pack('>i', dice.choice((-1, 1 << 30, 0x20000001, -(1 << 31), 65535)))
    return head + bytes(payload)


def send(path, count, seed, replay):
    dice, messages = random.Random(seed), [m for p in path.split(',') for m in pickle.load(open(p, 'rb'))]
    out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    out.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
    start, sent = time.time(), 0
    for n in range(count):
        port, message = dice.choice(messages)
        kind = n % 4
        if kind == 0:
            message = odd_parts(dice)
        elif kind == 1:
            message = odd_name(dice)
        elif kind == 2 or not replay:
            message = spoilt(dice, message)
        if kind < 2:
            port = dice.choice(PORTS)
        sent += out.sendto(message, (GROUP, port)) == len(message)
        ahead = start + n / 20000 - time.time()
        if ahead > 0.002:
            time.sleep(ahead)
    print(sent)


if sys.argv[1] == 'record':
    record(sys.argv[2], float(sys.argv[3]))
else:
    send(sys.argv[2], int(sys.argv[3]), int(sys.argv[4]), len(sys.argv) > 5)
