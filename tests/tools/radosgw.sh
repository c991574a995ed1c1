#!/usr/bin/env bash
# Ceph's radosgw with its S3 API, on loopback: radosgw.sh FOLDER [PORT]
#
# The first start also starts a monitor and an OSD that keeps its objects in memory, writes their processes to
# FOLDER/cluster, and creates the users of tests/tools/swift_s3.py. The script becomes radosgw, and prints its port once it
# answers. A PORT that was printed before serves the same objects again, as long as monitor and OSD run.
set -eu
folder=$1 port=${2:-}
export CEPH_CONF=$folder/ceph.conf CEPH_ARGS=
free_port() {
  python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])'
}

start_cluster() {
  local fsid osd monitor
  fsid=$(cat /proc/sys/kernel/random/uuid) osd=$(cat /proc/sys/kernel/random/uuid)
  monitor="[v2:127.0.0.1:$(free_port)]"
  mkdir -p "$folder/mon" "$folder/osd"
  # radosgw alone asks for a secure connection to the monitor, which needs keys.
  cat >"$CEPH_CONF" <<END
[global]
fsid = $fsid
mon_host = $monitor
public_addr = 127.0.0.1
ms_bind_msgr1 = false
ms_mon_client_mode = crc secure
auth_cluster_required = none
auth_service_required = none
auth_client_required = none
run_dir = $folder
admin_socket =
log_file = $folder/\$type.log
mon_cluster_log_file = $folder/cluster.log
mon_data = $folder/mon
mon_data_avail_crit = 1
mon_allow_pool_size_one = true
osd_data = $folder/osd
osd_objectstore = memstore
memstore_device_bytes = 4G
osd_crush_chooseleaf_type = 0
osd_pool_default_size = 1
osd_pool_default_min_size = 1
osd_pool_default_pg_num = 1
osd_pool_default_pg_autoscale_mode = off
rgw_data = $folder
rgw_thread_pool_size = 32
# By default Ceph also formats lines that it would only log after a crash.
debug_rgw = 1/1
debug_osd = 0/0
debug_ms = 0/0
debug_rados = 0/0
debug_objecter = 0/0
debug_objclass = 0/0
debug_bluestore = 0/0
debug_filestore = 0/0
debug_monc = 0/0
debug_mon = 0/0
debug_paxos = 0/0
debug_throttle = 0/0
debug_finisher = 0/0
debug_timer = 0/0
debug_optracker = 0/0
debug_auth = 0/0
debug_objectcacher = 0/0
debug_perfcounter = 0/0
debug_tp = 0/0
osd_enable_op_tracker = false
END
  monmaptool --create --fsid "$fsid" --addv a "$monitor" "$folder/monmap"
  ceph-mon --mkfs -i a --monmap "$folder/monmap"
  ceph-mon -f -i a &
  echo $! >"$folder/cluster"
  ceph --connect-timeout 60 osd new "$osd"
  ceph-osd --mkfs -i 0 --osd-uuid "$osd"
  ceph-osd -f -i 0 &
  echo $! >>"$folder/cluster"
  user orbmorph:daemon secret-of-the-daemon
  user orbmorph:guest secret-of-the-guest
  user other:daemon secret-of-the-other
}

user() {
  timeout 120 radosgw-admin user create --uid="${1/:/-}" --display-name="$1" --access-key="$1" --secret="$2"
}

if [ -z "$port" ]; then
  start_cluster >&2
  port=$(free_port)
fi
( # says so once it answers
  for ((i = 0; i < 600; i++)); do
    curl -s -o "$folder/answer" "http://127.0.0.1:$port/" && break
    sleep 0.1
  done
  grep -q ListAllMyBuckets "$folder/answer" && echo "$port"
) &
exec radosgw -f -n client.admin --rgw-frontends="beast endpoint=127.0.0.1:$port" >&2
