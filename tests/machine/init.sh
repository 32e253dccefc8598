#!/bin/bash
# PID 1 of the guest until the file system stands. The kernel hands its unknown words NAME=VALUE on as environment:
#   machine_dir   the directory that host and guest share (this script lies in it)
# The host's whole tree lies under an overlay whose upper layer is memory: the command sees every file of the host
# and may write anywhere, and nothing of it reaches the host but what is named in the file `writable`.
export PATH=/usr/sbin:/usr/bin:/sbin:/bin
modules=/usr/lib/uml/modules/$(uname -r)

fail() {
    echo "vcan-machine: init: $*" > /dev/kmsg
    # Power off without a status: the host then shows the kernel's log, in which the line above stands.
    echo o > /proc/sysrq-trigger
    sleep 10
}

mount -t proc proc /proc || fail "no /proc"
insmod "$modules/kernel/fs/overlayfs/overlay.ko" || fail "no overlayfs in $modules"
mount -t tmpfs -o mode=755 layers /mnt || fail "no memory for the upper layer"
mkdir /mnt/upper /mnt/work /mnt/root
root=/mnt/root
mount -t overlay -o lowerdir=/,upperdir=/mnt/upper,workdir=/mnt/work,xino=off overlay $root || fail "no overlay"

mkdir -p $root/proc $root/sys $root/dev $root/run
mount --move /proc $root/proc
mount -t sysfs sysfs $root/sys
mount -t devtmpfs devtmpfs $root/dev
mount -t tmpfs -o mode=755 run $root/run
mkdir -p $root/dev/pts $root/dev/shm $root/run/lock $root/run/vcan-machine
mount -t devpts -o mode=620,ptmxmode=666 devpts $root/dev/pts
# New shared memory: no service of the host shines through.
mount -t tmpfs -o mode=1777 shm $root/dev/shm
rm -rf $root/tmp/iceoryx2 $root/tmp/taustream*
for link in fd:fd stdin:fd/0 stdout:fd/1 stderr:fd/2; do
    ln -sf "/proc/self/${link#*:}" "$root/dev/${link%%:*}"
done
mkdir -p $root/lib/modules
ln -sfn "$modules" "$root/lib/modules/$(uname -r)"

mount -t hostfs -o "$machine_dir" shared $root/run/vcan-machine || fail "no hostfs of $machine_dir"
while IFS= read -r directory; do
    mount -t hostfs -o "$directory" writable "$root$directory" || fail "cannot mount $directory"
done < $root/run/vcan-machine/writable

exec chroot $root /bin/bash /run/vcan-machine/guest.sh
