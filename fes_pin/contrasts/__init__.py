"""What differs between groups of trials of one rig."""
