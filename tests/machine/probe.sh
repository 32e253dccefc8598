#!/bin/bash
# What a service may do, tried from inside its sandbox; one line `NAME yes|no` for each. Perl, which every Debian has,
# makes the system calls that no command makes.
try() {
    local name=$1
    shift
    if "$@" > /dev/null 2>&1; then echo "$name yes"; else echo "$name no"; fi
}
writes_sysctl() { echo machine > /proc/sys/kernel/hostname; }
mounts() { mount -t tmpfs none /mnt && umount /mnt; }
writes() { : > "$1" && rm -f "$1"; }
sees_others() { [ -d /proc/1/fd ] || [ -e /proc/1/comm ]; }
has_capabilities() { ! grep -q '^CapBnd:.0*$' /proc/self/status; }
may_gain_rights() { ! grep -q '^NoNewPrivs:.1$' /proc/self/status; }
is_root() { [ "$(id -u)" = 0 ]; }
# Refused is what ends with EPERM; whatever else the kernel says of the arguments, it has let them through.
syscall() { perl -e 'my @a = map { int } @ARGV; exit(syscall(shift(@a), @a) == -1 && $! == 1)' -- "$@"; }
opens() { perl -e 'exit(!socket(my $s, $ARGV[0], $ARGV[1], $ARGV[2]))' "$@"; }

try root is_root
try capabilities has_capabilities
try gain-rights may_gain_rights
try write-etc writes /etc/probe
try write-usr writes /usr/probe
try write-home writes /home/probe
try write-proc-sys writes_sysctl
try read-home ls /home/olga
try write-tmp writes /tmp/probe
try write-runtime writes /run/taustream/probe
try write-shm writes /dev/shm/probe
try see-processes sees_others
try device-disk test -e /dev/ubda
# AF_UNIX 1, AF_INET 2, AF_INET6 10, AF_NETLINK 16, AF_PACKET 17, AF_CAN 29; SOCK_DGRAM 2, SOCK_RAW 3, CAN_RAW 1.
try socket-unix opens 1 2 0
try socket-inet opens 2 2 0
try socket-inet6 opens 10 2 0
try socket-netlink opens 16 3 0
try socket-packet opens 17 2 0
try socket-can opens 29 3 1
# x86-64: mmap 9 (read, write and execute; private, anonymous), ptrace 101 (TRACEME), mlockall 151
# (current), keyctl 250, bpf 321.
try map-writable-code syscall 9 0 4096 7 34 -1 0
try trace syscall 101 0 0 0 0
try lock-memory syscall 151 1
try keyring syscall 250 0 -3 0 0 0
try bpf syscall 321 0 0 0
try namespaces unshare --user true
try mount mounts
try clock date -s "@$(date +%s)"
try realtime chrt -f 50 true
# journald may still be reading these lines when the unit has ended: whoever waits for this one has them all.
echo 'probes ended'
