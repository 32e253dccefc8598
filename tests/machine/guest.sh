#!/bin/bash
# PID 1 of the guest once the file system stands: brings the CAN interfaces up, runs the command, leaves its status.
# From the kernel's words: machine_interfaces. From the shared directory: command.sh, which the host has written (the
# caller's environment, umask and working directory, then the command under its time limit).
export PATH=/usr/sbin:/usr/bin:/sbin:/bin
shared=/run/vcan-machine

finish() {
    echo "$1" > $shared/status
    sync
    echo o > /proc/sysrq-trigger
    sleep 10
}

# stdout and stderr of the command are two consoles, raw, so that its bytes reach the host unchanged.
stty -F /dev/tty1 raw -echo -opost
stty -F /dev/tty2 raw -echo -opost
exec 8> /dev/tty1 9> /dev/tty2
fail() {
    echo "vcan-machine: guest: $*" >&9
    finish 125
}

cd / || fail "no /"
echo "vcan-machine: guest kernel $(uname -r)" >&9
modprobe -a can can-raw can-dev vcan 2>&9 || fail "the guest's kernel has no CAN"
modprobe -a can-gw can-bcm vxcan 2> /dev/null
ip link set lo up
for ((i = 0; i < machine_interfaces; i++)); do
    # MTU 72: CAN FD frames pass too.
    ip link add dev "vcan$i" type vcan && ip link set "vcan$i" mtu 72 && ip link set "vcan$i" up ||
        fail "cannot bring vcan$i up"
done
# No throttling of SCHED_FIFO: the default stops a real-time thread for 50 ms in each second of full load.
echo -1 > /proc/sys/kernel/sched_rt_runtime_us
/bin/bash $shared/can-softirq.sh || fail "the thread of software interrupts cannot be raised"
echo vcan-machine > /proc/sys/kernel/hostname

# The command writes into pipes, for a program that finds a terminal may behave otherwise.
mkfifo /run/stdout /run/stderr
cat /run/stdout >&8 &
stdout=$!
cat /run/stderr >&9 &
stderr=$!
(
    exec 8>&- 9>&-
    unset machine_dir machine_interfaces
    ulimit -l unlimited
    ulimit -n "$(ulimit -Hn)"
    ulimit -r 99
    . $shared/command.sh
) < /dev/null > /run/stdout 2> /run/stderr
status=$?
# A process that the command left behind may hold the pipes open: it gets 2 s more.
(
    sleep 2
    kill $stdout $stderr 2> /dev/null
) &
wait $stdout $stderr
# What the consoles still hold must reach the host before the power goes.
stty -F /dev/tty1 > /dev/null
stty -F /dev/tty2 > /dev/null
sleep 0.05
finish $status
