"""A gamepad or the keyboard as MAVLink sticks, for people without a ground station; and the files that map sticks."""
