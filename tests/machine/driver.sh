#!/bin/bash
# What the guest's driver unit starts: the command of the host, its status, the journal, the end.
finish() {
    journalctl --boot --output=short-monotonic --no-pager > /machine/output/journal.txt 2>&1
    echo "$1" > /machine/status
    sync
}

# stdout and stderr are two consoles, raw, so that bytes reach the host unchanged.
stty -F /dev/tty1 raw -echo -opost
stty -F /dev/tty2 raw -echo -opost
exec > /dev/tty1 2> /dev/tty2 < /dev/null
echo "systemd machine: guest kernel $(uname -r), $(systemctl --version | head -n 1)" >&2
. /machine/command.sh
finish $?
stty -F /dev/tty1 > /dev/null
stty -F /dev/tty2 > /dev/null
sleep 0.05
