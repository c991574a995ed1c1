"""OpenStack Swift with its S3 API, all four servers in one process on loopback: swift_s3.py FOLDER [PORT]

One replica on one device below FOLDER, users in the configuration. Prints the port of the proxy once it answers, and
serves until it is killed. A PORT that was printed before serves the same data again.
"""

import json
import os
import sys

import eventlet

eventlet.monkey_patch()

from eventlet import wsgi  # noqa: E402
from swift.common import ring, utils  # noqa: E402
from swift.common.ring import builder  # noqa: E402
from swift.common.storage_policy import reload_storage_policies  # noqa: E402
from swift.common.wsgi import loadapp  # noqa: E402

SERVERS = {"account": "account", "container": "container", "object": "object"}
SERVER = """[DEFAULT]
devices = {folder}/disks
mount_check = false
swift_dir = {folder}
[app:main]
use = egg:swift#{name}
disable_fallocate = true
"""
PROXY = """[DEFAULT]
swift_dir = {folder}
[pipeline:main]
pipeline = catch_errors cache listing_formats s3api tempauth slo proxy-server
[app:proxy-server]
use = egg:swift#proxy
account_autocreate = true
node_timeout = 30
[filter:catch_errors]
use = egg:swift#catch_errors
[filter:cache]
paste.filter_factory = swift_cache:filter_factory
[filter:listing_formats]
use = egg:swift#listing_formats
[filter:s3api]
use = egg:swift#s3api
location = us-east-1
s3_acl = false
force_swift_request_proxy_log = false
[filter:tempauth]
use = egg:swift#tempauth
user_orbmorph_daemon = secret-of-the-daemon .admin
user_orbmorph_guest = secret-of-the-guest
user_other_daemon = secret-of-the-other .admin
[filter:slo]
use = egg:swift#slo
min_segment_size = 1
"""


class Cache:
    """What tempauth and the proxy need of memcached."""

    def __init__(self):
        self.kept = {}

    def get(self, key, **_):
        return self.kept.get(key)

    def set(self, key, value, **_):
        self.kept[key] = json.loads(json.dumps(value))

    def delete(self, key, **_):
        self.kept.pop(key, None)

    def incr(self, key, delta=1, **_):
        self.kept[key] = int(self.kept.get(key, 0)) + delta
        return self.kept[key]

    def decr(self, key, delta=1, **_):
        return self.incr(key, -delta)

    def set_multi(self, mapping, server_key, **_):
        self.kept.update(mapping)

    def get_multi(self, keys, server_key, **_):
        return [self.kept.get(key) for key in keys]


def filter_factory(_, **__):
    cache = Cache()

    def wrap(app):
        def serve(env, start_response):
            env["swift.cache"] = cache
            return app(env, start_response)

        return serve

    return wrap


class Quiet:
    """Takes the access log."""

    def write(self, _):
        pass


def write(folder, name, text):
    with open(os.path.join(folder, name), "w", encoding="utf-8") as file:
        file.write(text)


def make_ring(folder, name, port):
    rings = builder.RingBuilder(2, 1, 0)
    rings.add_dev({"region": 1, "zone": 1, "weight": 1, "ip": "127.0.0.1", "port": port, "device": "disk"})
    rings.rebalance()
    rings.get_ring().save(os.path.join(folder, name + ".ring.gz"))


def main():
    folder, port = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 0
    os.makedirs(os.path.join(folder, "disks", "disk"), exist_ok=True)
    sys.modules["swift_cache"] = sys.modules["__main__"]
    write(folder, "swift.conf", "[swift-hash]\nswift_hash_path_suffix = orbmorph\n[storage-policy:0]\nname = one\ndefault = yes\n")
    utils.SWIFT_CONF_FILE = os.path.join(folder, "swift.conf")
    utils.HASH_PATH_SUFFIX = b"orbmorph"
    reload_storage_policies()
    for name in SERVERS:
        socket = eventlet.listen(("127.0.0.1", 0))
        make_ring(folder, name, socket.getsockname()[1])
        write(folder, name + ".conf", SERVER.format(folder=folder, name=name))
        app = loadapp(os.path.join(folder, name + ".conf"), global_conf={"log_requests": "false"})
        eventlet.spawn(wsgi.server, socket, app, log=Quiet())
    write(folder, "proxy.conf", PROXY.format(folder=folder))
    socket = eventlet.listen(("127.0.0.1", port))
    app = loadapp(os.path.join(folder, "proxy.conf"), global_conf={"log_requests": "false"})
    print(socket.getsockname()[1], flush=True)
    wsgi.server(socket, app, log=Quiet())


if __name__ == "__main__":
    main()
