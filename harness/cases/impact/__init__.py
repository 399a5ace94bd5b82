"""Impacts: of two disks, on a plane, of many disks in a box."""
