# Sourced by tests that install Knead into a root that mmdebstrap makes, as on a fresh machine.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
[ "$(id -u)" = 0 ] || skip "only root can make a root to install into"
command -v mmdebstrap >/dev/null || skip "no mmdebstrap here (tests/packages)"
read -r _ _ _ parent _ <"/proc/$PPID/stat"
outside="nsenter --net=/proc/$parent/ns/net" # the network that this test was started in
make_root() { # make_root RELEASE [OPTION|MIRROR...]: in the folder root; return 77 if no mirror answers
    $outside mmdebstrap --quiet --variant=minbase "${@:2}" "$1" root 2>mmdebstrap.log ||
        { cat mmdebstrap.log && return 77; }
    cp /etc/resolv.conf root/etc/resolv.conf
}
inside() { # [network=$outside] inside COMMAND...: in root. Its mounts end with the command, so root can be removed at any time
    env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin LC_ALL=C.UTF-8 DEBIAN_FRONTEND=noninteractive \
        ${network-} unshare -m sh -c 'mount -t proc proc root/proc && mount --rbind /sys root/sys && mount --rbind /dev root/dev &&
            exec chroot root "$@"' - "$@"
}
took() { echo "     $1: $((SECONDS - since)) s" && since=$SECONDS; }
since=$SECONDS
