"""A Ray cluster of two nodes on this machine: a line on the standard input kills the second one.

Prints its address when it is there. It is a process of its own, since Ray leaves threads and files
open in the process that starts it.
"""

import sys

from ray.cluster_utils import Cluster


def main() -> None:
    """Start the cluster, kill a node when asked, and end with the input."""
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    second = cluster.add_node(num_cpus=1)
    cluster.wait_for_nodes()
    print(cluster.address, flush=True)
    if sys.stdin.readline():
        cluster.remove_node(second, allow_graceful=False)
        print("killed", flush=True)
    sys.stdin.read()
    cluster.shutdown()


if __name__ == "__main__":
    main()
