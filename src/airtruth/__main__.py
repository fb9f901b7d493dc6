"""python -m airtruth"""

from airtruth.cli import main

main()
