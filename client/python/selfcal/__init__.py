"""Reads what selfcald knows: segments, tables, calibrations and runs::

    with selfcal.connect("unix:/run/selfcal/selfcald.sock") as daemon:
        for segment in daemon.segments("tablet"):
            print(segment.name, segment.state)

The messages are those of the contract, selfcal.v1. Errors are grpc.RpcError.
"""

from selfcal.client import Daemon, Tls, connect

__all__ = ["Daemon", "Tls", "connect"]
