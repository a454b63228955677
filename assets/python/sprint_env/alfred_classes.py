"""The 81 object classes that ALFRED's actions name; with "none", which comes first, they are the 82 of its object head."""

CLASSES = """
AlarmClock Apple ArmChair BaseballBat BasketBall Bathtub Bed Book Bowl Box Bread ButterKnife CD Cabinet Candle
Cart CellPhone Cloth CoffeeMachine CoffeeTable CounterTop CreditCard Cup Desk DeskLamp DiningTable DishSponge
Drawer Dresser Egg Faucet FloorLamp Fork Fridge GarbageCan Glassbottle HandTowel Kettle KeyChain Knife Ladle
Laptop Lettuce Microwave Mug Newspaper Ottoman Pan Pen Pencil PepperShaker Pillow Plate Plunger Pot Potato
RemoteControl Safe SaltShaker Shelf SideTable Sink SoapBar SoapBottle Sofa Spatula Spoon SprayBottle Statue
StoveBurner TVStand TennisRacket TissueBox Toilet ToiletPaper ToiletPaperHanger Tomato Vase Watch WateringCan
WineBottle
""".split()
