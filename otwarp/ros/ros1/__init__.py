"""ROS 1 in Python alone: a node on the graph of a master, and the simulator's end of the paper's topics on it.

Importing this package needs nothing; making a `Ros1Node` needs `rosbags` (`pip install 'otwarp[ros1]'`).
Messages come in over TCP and go to callbacks in threads of their publishers; what is published leaves by a thread and a
bounded queue per subscriber. Open `node` first.

- `bridge`: what a live loop publishes, and how far the hands' twists move its traps.
- `node`: registers with a master, publishes, subscribes, and comes back after restarts.
- `publisher`, `subscriber`: the two ends of a topic, with a link per peer.
- `rpc`: XML-RPC calls to a master or node, and the server for theirs.
- `wire`: bytes of TCPROS.
- `messages`: types, md5 sums and bytes, by `rosbags`.
- `names`: of nodes, topics, master and host, from the environment.
- `log`: what went wrong, bounded.
"""
