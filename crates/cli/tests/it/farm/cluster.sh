#!/bin/bash
# A Slurm cluster of two nodes on this machine, in a folder of its own: cluster.sh start|node|stop FOLDER [NODE]
set -eu
folder=$2
me=$(id -un)
host=$(hostname -s)
export SLURM_CONF=$folder/slurm.conf PATH=$PATH:/usr/sbin:/sbin

# Configuration, with a key and a socket of its own
configure() {
  mkdir -p "$folder/state"
  chmod 755 "$folder"
  head -c 1024 /dev/urandom >"$folder/munge.key"
  chmod 600 "$folder/munge.key"
  cat >"$SLURM_CONF" <<END
ClusterName=test
SlurmctldHost=$host(127.0.0.1)
SlurmUser=$me
SlurmdUser=$me
AuthInfo=socket=$folder/munge.socket
SlurmctldPort=$((base))
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/%n.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/%n.log
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool.%n
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SlurmdParameters=config_overrides
MailProg=/bin/true
ReturnToService=2
NodeName=node1 NodeHostname=$host NodeAddr=127.0.0.1 Port=$((base + 1)) CPUs=1
NodeName=node2 NodeHostname=$host NodeAddr=127.0.0.1 Port=$((base + 2)) CPUs=1
PartitionName=all Nodes=node1,node2 Default=YES State=UP
END
  # Without it, newer versions look for cgroups
  case $(slurmd -V) in *" 2"[0-2].*) ;; *) echo CgroupPlugin=disabled >"$folder/cgroup.conf" ;; esac
}

case $1 in
  start)
    base=$((20000 + $$ % 10000))
    configure
    munged --key-file="$folder/munge.key" --socket="$folder/munge.socket" --pid-file="$folder/munged.pid" \
      --log-file="$folder/munged.log" --seed-file="$folder/munged.seed"
    slurmctld
    slurmd -N node1
    slurmd -N node2
    for _ in $(seq 60); do
      [ "$(sinfo --noheader --states=idle --format=%D)" != 2 ] || exit 0
      sleep 0.5
    done
    echo "the nodes are not idle after 30 s:" >&2
    sinfo >&2
    tail -n 20 "$folder"/*.log >&2
    exit 1
    ;;
  node) slurmd -N "$3" ;;
  stop)
    for pid in node1 node2 slurmctld munged; do
      [ ! -s "$folder/$pid.pid" ] || kill "$(cat "$folder/$pid.pid")" 2>/dev/null || true
    done
    ;;
esac
