"""The aircraft as a MAVLink vehicle: a process of its own between the flight's rows and the ground stations.

The flight pushes rows into a ring and reads sticks and requests from shared memory; everything that talks to a client
happens in the other process, so nothing a client does can hold up a frame.
"""
