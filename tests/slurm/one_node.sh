#!/usr/bin/env bash
# A Slurm cluster of one node on this machine, for tests on machines that can be thrown away.
#
#   tests/slurm/one_node.sh install       Debian's packages, as root
#   tests/slurm/one_node.sh start FOLDER  as root; keeps its state and logs in FOLDER
#   tests/slurm/one_node.sh stop FOLDER
#
# The settings must be where Slurm looks for them, because the jobs that Snakemake submits lose
# SLURM_CONF; settings that are not of this script are left alone.
set -euo pipefail
settings=/etc/slurm/slurm.conf
mark="# written by tests/slurm/one_node.sh"

install() {
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends slurm-wlm munge
}

start() {
    local folder name
    folder="$(realpath "$1")"
    name="$(hostname -s)"
    if [ -e "$settings" ] && ! grep -qxF "$mark" "$settings"; then
        echo "error: $settings is there and not of this script; Slurm of this machine is left alone" >&2
        exit 1
    fi
    grep -qw "$name" /etc/hosts || echo "127.0.0.1 $name" >>/etc/hosts
    mkdir -p "$folder" /etc/slurm /run/munge
    cat >"$settings" <<END
$mark
ClusterName=one
SlurmctldHost=$name(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
CommunicationParameters=NoInAddrAny,NoCtldInAddrAny
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.log
ProctrackType=proctrack/pgid
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
ReturnToService=2
MpiDefault=none
NodeName=$name NodeAddr=127.0.0.1 CPUs=$(nproc) RealMemory=6000 State=UNKNOWN
PartitionName=all Nodes=$name Default=YES MaxTime=INFINITE State=UP
END
    mkdir -p "$folder/state" "$folder/spool"
    if ! munge -n 2>/dev/null | unmunge >/dev/null 2>&1; then
        dd if=/dev/urandom of=/etc/munge/munge.key bs=1024 count=1 status=none
        chown -R munge: /etc/munge /run/munge
        chmod 400 /etc/munge/munge.key
        runuser -u munge -- munged --pid-file="/run/munge/munged.pid"
        cp /run/munge/munged.pid "$folder/munged.pid"
    fi
    slurmctld
    slurmd -N "$name"
    for _ in $(seq 60); do
        if sinfo -h -o %T 2>/dev/null | grep -qx idle; then
            exit 0
        fi
        sleep 0.5
    done
    echo "error: the node does not become idle; see the logs in $folder" >&2
    exit 1
}

stop() {
    local pid
    for pid in slurmd slurmctld munged; do
        if [ -s "$1/$pid.pid" ]; then
            kill "$(cat "$1/$pid.pid")" 2>/dev/null || true
        fi
    done
    if grep -qxF "$mark" "$settings" 2>/dev/null; then
        rm "$settings"
    fi
}

case "${1:-}" in
    install) install ;;
    start | stop) "$1" "${2:?which folder}" ;;
    *) sed -n '2,9s/^# \{0,1\}//p' "$0"; exit 2 ;;
esac
