"""What tests compare with: independent judges and solvers, and the random cases that they draw.

May import everything of the packages; nothing of the code that they judge where it can be helped.
"""
