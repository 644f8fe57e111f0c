"""`python -m hand_tool` is the command `hand`."""

from hand_tool.main import main

if __name__ == "__main__":
    main()
