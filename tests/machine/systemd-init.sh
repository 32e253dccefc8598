#!/bin/bash
# PID 1 of the guest until systemd takes over. The kernel hands its unknown words NAME=VALUE on as environment:
#   machine_dir   the directory that host and guest share (this script lies in it), later /machine
#   machine_out   a directory of the host that stays writable, later /machine/output
# The root is the Debian image, read-only, under a layer in memory with what the tests install.
export PATH=/usr/sbin:/usr/bin:/sbin:/bin
modules=/usr/lib/uml/modules/$(uname -r)

fail() {
    echo "systemd machine: init: $*" > /dev/kmsg
    # Power off without a status: the host then shows the kernel's log, in which the line above stands.
    echo o > /proc/sysrq-trigger
    sleep 10
}

mount -t proc proc /proc || fail "no /proc"
for module in overlayfs/overlay squashfs/squashfs; do
    insmod "$modules/kernel/fs/$module.ko" || fail "no $module in $modules"
done
mount -t tmpfs -o mode=755,size=75% layers /mnt || fail "no memory for the upper layer"
mkdir /mnt/image /mnt/upper /mnt/work /mnt/root
root=/mnt/root
mount -t squashfs -o ro /dev/ubda /mnt/image || fail "no Debian image"
mount -t overlay -o lowerdir=/mnt/image,upperdir=/mnt/upper,workdir=/mnt/work,xino=off overlay $root ||
    fail "no overlay"
tar -C $root -xf "$machine_dir/files.tar" || fail "cannot unpack the files"
mkdir -p "$root/usr/lib/modules/$(uname -r)" $root/machine
mount --bind "$modules" "$root/usr/lib/modules/$(uname -r)" || fail "cannot bind the modules"
mount -t hostfs -o "$machine_dir" shared $root/machine || fail "no hostfs of $machine_dir"
mkdir -p $root/machine/output
mount -t hostfs -o "$machine_out" output $root/machine/output || fail "no hostfs of $machine_out"
umount /proc
cd $root || fail "no root"
exec switch_root $root /lib/systemd/systemd
