"""What a flight must do, written in signal temporal logic over the frame's signals."""
