"""The paper's section 4 flown by the code that flies: scenes, flights, measures, studies."""
