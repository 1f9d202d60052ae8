"""Client of selfcald: segments, tables, calibrations and runs::

    with selfcal.connect("unix:/run/selfcal/selfcald.sock") as daemon:
        for segment in daemon.segments("tablet"):
            print(segment.name, segment.state)

Messages are those of the contract, selfcal.v1. Errors are raised as
grpc.RpcError.
"""

from selfcal.client import Daemon, Tls, connect

__all__ = ["Daemon", "Tls", "connect"]
